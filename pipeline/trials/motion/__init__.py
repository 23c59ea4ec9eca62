"""The bench of the trial in motion: manoeuvres on elastic shafts with regulated drives, concealed effects, readings."""
