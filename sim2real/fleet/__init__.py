"""What diagnosed stations say of one that is not diagnosed yet."""
