"""What repeats with the turn of a shaft: amplitude and phase of orders, flux density of the coils, load angle."""
