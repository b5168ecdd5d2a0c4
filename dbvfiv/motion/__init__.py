"""The valve in time: equations of motion, scheme, steps and their control."""
