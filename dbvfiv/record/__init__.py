"""Results in files: journals that grow while a study runs, read back without computing anew, handed to ParaView."""
