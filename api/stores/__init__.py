"""The store: keys, machines with their identifications, toolings, campaigns and jobs; every row belongs to a group."""
