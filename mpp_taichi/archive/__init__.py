"""Archives: files of checksummed records, from which a run that was cut off goes on with the same bits."""
