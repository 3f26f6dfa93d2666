"""What every room uses: arrays, errors, warnings, progress."""
