"""The window "Hand joints": watching, training, exporting."""
