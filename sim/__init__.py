"""Physics of the planetary magnetic gearbox bench: arrays in, arrays out."""
