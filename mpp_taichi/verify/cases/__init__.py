"""The cases of the examination, a file for each group; each case is a function with a source and a bound."""
