"""The command line, `getup`: a folder for each section of `getup --help`."""
