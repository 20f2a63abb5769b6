"""XDF files of Lab Streaming Layer."""
