# The program within the Python package, and what it calls, where it looks for them: `python -m limn`.
install(TARGETS limn RUNTIME DESTINATION limn/bin COMPONENT python)
install(PROGRAMS tools/report.py DESTINATION limn/share/limn COMPONENT python)
install(DIRECTORY tools/report DESTINATION limn/share/limn COMPONENT python
  FILES_MATCHING PATTERN "*.py" PATTERN "*.css" PATTERN "__pycache__" EXCLUDE)
install(PROGRAMS tools/mitsuba/mitsuba_gradient.py
  DESTINATION limn/share/limn/mitsuba COMPONENT python)
