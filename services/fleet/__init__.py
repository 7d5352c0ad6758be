"""Many stations on many machines: shards of stations as long-lived tasks of Dask."""
