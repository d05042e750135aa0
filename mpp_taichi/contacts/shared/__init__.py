"""Parts of several contact solvers: formulas of a contact, counts, memory of fields."""
