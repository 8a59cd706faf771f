export async function intake() {}
