"""Order analysis: amplitude and phase of orders, flux density of the coils, load angle."""
