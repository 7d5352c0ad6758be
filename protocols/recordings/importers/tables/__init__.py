"""Files of an export as columns: text in any encoding, Excel, Parquet."""
