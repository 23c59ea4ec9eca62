"""What the residual of any fit on any grid follows."""
