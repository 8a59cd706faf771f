"""What is written once something was identified or learnt, and read again."""
