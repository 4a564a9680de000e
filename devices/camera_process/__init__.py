"""A camera whose library may block or crash, read in a process of its own: frames come by shared memory."""
