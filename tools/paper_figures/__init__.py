"""The figures and tables of Soroka, Peters and Marschner (2025), made again: tools/paper --figures."""
