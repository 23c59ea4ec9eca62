"""What an analysed grid says: comparison with the simulation, tolerances, power flow, documents."""
