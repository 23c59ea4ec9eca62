"""Structure in the residual of any fit on any grid."""
