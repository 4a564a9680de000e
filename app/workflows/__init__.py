"""What a visit may do and when: state tables and the visit session. No Qt here."""
