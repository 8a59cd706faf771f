"""The store: keys, machines with their identifications, toolings, robots, campaigns and jobs; every row belongs to a group."""
