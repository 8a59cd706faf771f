"""Transfer of bodies: streamed to the disk, split into parts, packed into archives."""
