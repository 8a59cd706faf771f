"""What people write: campaigns, toolings, cuts, machines, robots, modes."""
