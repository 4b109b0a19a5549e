/**
 * A network between a browser and a server on this machine, which can be cut as a cable is: nothing comes through, and neither end is
 * told. What was on its way comes through once it is mended, where both ends have kept their connection so long.
 */
import net from "node:net";

export class Network {
  /** Passes what reaches the port `near` on to the port `far`. */
  static async open(near, far) {
    const network = new Network(far);
    await new Promise((resolve, reject) => network.server.once("error", reject).listen(near, "127.0.0.1", resolve));
    return network;
  }

  constructor(far) {
    this.far = far;
    this.isCut = false;
    this.sockets = new Set();
    this.server = net.createServer((near) => this.join(near, net.connect(this.far, "127.0.0.1")));
  }

  join(...ends) {
    for (const [end, other] of [ends, ends.toReversed()]) {
      this.sockets.add(end);
      end.on("data", (bytes) => other.write(bytes));
      end.on("end", () => other.end());
      // An end that is reset takes the other with it.
      end.on("error", () => other.destroy());
      end.on("close", () => {
        this.sockets.delete(end);
        other.destroy();
      });
      if (this.isCut) end.pause();
    }
  }

  cut() {
    this.isCut = true;
    for (const socket of this.sockets) socket.pause();
  }

  mend() {
    this.isCut = false;
    for (const socket of this.sockets) socket.resume();
  }

  close() {
    for (const socket of this.sockets) socket.destroy();
    this.server.close();
  }
}
