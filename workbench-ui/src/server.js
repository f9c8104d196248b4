// Questions to the server, and jobs of its workers.

export class Failure extends Error {
  constructor(error) {
    super(error.message);
    Object.assign(this, error);
  }
}

async function post(path, body, signal) {
  return fetch(path, { method: "POST", body: JSON.stringify(body), headers: { "Content-Type": "application/json" }, signal }).catch((error) => {
    if (error.name === "AbortError") throw error;
    throw new Failure({ message: "the workbench has ended: start it again; the browser keeps unsaved texts" });
  });
}

/** A question that is answered at once. */
export async function ask(name, body = {}) {
  const response = await post(`/api/${name}`, body);
  if (response.status === 403) throw new Failure({ message: await response.text() });
  const answer = await response.json();
  if (answer.error) throw new Failure(answer.error);
  return answer;
}

/** A job; `told` gets each message before the result. To abort the signal ends the process. */
export async function run(worker, job, { told = () => {}, signal } = {}) {
  const response = await post(`/job/${worker}`, job, signal);
  if (!response.ok) throw new Failure({ message: await response.text() });
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { value, done } = await reader.read();
    if (done) throw new Failure({ message: "the server has ended" });
    const lines = (rest + value).split("\n");
    rest = lines.pop();
    for (const line of lines) {
      const message = JSON.parse(line);
      if (message.error) throw new Failure(message.error);
      if (message.result) return message.result;
      told(message);
    }
  }
}
