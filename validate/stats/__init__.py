"""Statistics: rank correlation, intervals by resampling, regret and consistency."""
