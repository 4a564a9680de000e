"""The demonstration: a clinic with simulated patients, by hand or through the real windows by itself."""
