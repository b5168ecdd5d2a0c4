"""What is fast, measured: ratios taken in one run, printed beside their targets; nothing here fails on time."""
