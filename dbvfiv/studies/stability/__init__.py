"""What studies of stability share: places of the parameter space, their steady states and spectra, crossings."""
