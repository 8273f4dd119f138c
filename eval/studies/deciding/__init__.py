"""When to answer, if each activity is answered once and waiting costs: a study of finished runs."""
