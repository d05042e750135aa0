"""The sections of the paper report, one module each; `page` is what they are made of, `runs` how they run scenes."""
