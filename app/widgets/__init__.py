"""Widgets every page is made of. Each module's documentation lists its methods and signals.

``PhotoView``      photo with numbered markers            app.widgets.photo_view
``BodyView``       3D body with numbered lesions          app.widgets.body_view
``CompareView``    two photos side by side or overlaid    app.widgets.compare_view
``LesionTable``    the lesions of a patient               app.widgets.lesion_table
``StepBar``, ``MessageBanner``, ``ProgressOverlay``, ``EmptyState``    app.widgets.status
``Sheet``, ``ask``, ``tell``                              dialogs inside the window, app.widgets.sheet
``SiteField``      search field for an anatomic site      app.widgets.site_field
"""
