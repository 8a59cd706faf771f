"""What is cut with what, and how: toolings, workpieces, cuts."""
