"""The measured grid of a campaign: its points, their uncertainty budgets, and what is missing."""
