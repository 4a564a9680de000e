"""Colour cameras beside the depth camera: webcams, tethered still cameras, and the rig that pairs them."""
