"""What is here to be checked, not run."""

collect_ignore = ["user_code.py"]
