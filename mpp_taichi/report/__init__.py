"""What a run tells at its end: summary, result, expectations."""
