"""The second application: joints of a hand by geodesics from an ArUco marker (thesis chapter 4)."""
