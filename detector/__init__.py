"""The judgement: gate, pump runs, baseline, the paper's two methods, one verdict per pump run."""
