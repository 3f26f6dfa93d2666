"""XML files of the course's format -> a Scene."""
