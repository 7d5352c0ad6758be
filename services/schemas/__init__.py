"""JSON Schemas of the files that people write and programs read, made from the models that check them."""
