"""OpenNI2: live cameras and ``.oni`` recordings through the real runtime, and a writer of ``.oni`` files."""
