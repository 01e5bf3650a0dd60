/* The table of settings on stdout. */
#ifndef FATHOM_SETTINGS_PAGE_H
#define FATHOM_SETTINGS_PAGE_H

/* Name, unit, range, default and meaning in columns, one line per setting. */
void settings_page_text(void);

/* The same as docs/SETTINGS.md. */
void settings_page_markdown(void);

#endif
