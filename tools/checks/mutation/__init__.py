"""Parts of mutate.py: where a mutant can be made, which ones there are, which tests belong to it, and one trial."""
