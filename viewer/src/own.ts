/** What an object has under a name of its own: names come from the run, and one of them may be `constructor`, which every object inherits. */
export const own = <T>(object: Readonly<Record<string, T>>, name: string): T | undefined => (Object.hasOwn(object, name) ? object[name] : undefined);
