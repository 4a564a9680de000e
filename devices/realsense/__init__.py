"""Intel RealSense cameras and their .bag recordings, through the optional library pyrealsense2."""
