/** What fails in the page itself is said, as what cannot be read is: a listener that throws would otherwise do so without a word. */
export function watchDefects(target: Pick<Window, "addEventListener">, report: (text: string) => void): void {
  target.addEventListener("error", (event) => {
    // A notice of the browser, such as that sizes are told a picture later, comes without an error.
    const { error } = event as { error?: unknown };
    if (error !== null && error !== undefined) report(defectText(error));
  });
  target.addEventListener("unhandledrejection", (event) => report(defectText(event.reason)));
}

const defectText = (error: unknown): string => `in this page, ${error instanceof Error ? `${error.name}: ${error.message}` : String(error)}`;
