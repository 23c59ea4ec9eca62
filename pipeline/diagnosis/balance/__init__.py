"""Terms of a force balance, named from recordings of any machine; a drive on a slide is the first."""
