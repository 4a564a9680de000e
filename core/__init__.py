"""What the application knows: surfaces, geodesics, relocation, records, exchange. No Qt, no device."""
