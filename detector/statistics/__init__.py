"""Statistics: F-tests, CUSUM, bootstrap, tangent residuals, medians."""
