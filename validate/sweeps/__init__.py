"""One sweep: plan, prediction beside measurement, and the rows of its tables."""
