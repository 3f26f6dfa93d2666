"""XML files of the course's format, with the OBJ, PNG and JPEG files that they name -> a Scene."""
