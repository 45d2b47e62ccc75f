"""The law: what each method costs on a view, predicted from counts of boxes along a sample of its rays."""
