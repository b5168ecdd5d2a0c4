"""Actions behind the commands. All imports stand at the top here, however heavy."""
