"""Terms of a regression named from recordings of any machine; a drive on a slide is the first."""
