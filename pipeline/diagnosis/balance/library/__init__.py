"""Terms of a machine's balance of forces or torques, each declared once."""
