"""What the commands do, once they are asked to: here all imports stand at the top, however heavy."""
