"""What the service keeps: keys, machines with their identification, toolings; every row belongs to a group."""
