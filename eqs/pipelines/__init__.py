"""What a command does: configuration to objects to files, a module for each command."""
