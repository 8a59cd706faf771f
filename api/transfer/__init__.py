"""Bodies on their way in and out: streamed to the disk, taken apart into parts, packed into archives."""
