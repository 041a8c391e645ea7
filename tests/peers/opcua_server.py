"""A machine behind PyPI `asyncua` as an OPC UA server, driven line by line.

    opcua_server.py '{"port": 4840, "namespaces": ["urn:abbe:machine"], "values": {"X": 1.5}, "secured": "FOLDER"}'

The namespaces are registered in the order of the list, so their indices follow it; the values are variables of the
object `Machine` in `urn:abbe:machine`, with their names as identifiers. With `secured` the one endpoint is
Basic256Sha256 with Sign&Encrypt, and key and certificate are made in that folder.

Events go to standard output, one JSON object a line: `ready`, then `done` for each command. Commands come on standard
input: {"write": NAME, "value": V, "status": NUMBER, "at_s": SECONDS} writes one value; {"burst": COUNT, "names": [...]}
writes numbers from 0 on, in turn to the names. The end of standard input ends the program.
"""

from __future__ import annotations

import asyncio
import datetime
import ipaddress
import json
import sys
from pathlib import Path

from asyncua import Server, ua

MACHINE = "urn:abbe:machine"
APPLICATION = "urn:abbe:test:server"


def said(**event) -> None:
    print(json.dumps(event), flush=True)


def made_certificate(folder: Path) -> tuple[Path, Path]:
    """A key and a certificate that it signs itself."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import rsa
    from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

    key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "Abbe test server")])
    now = datetime.datetime.now(datetime.timezone.utc)
    alternatives = [
        x509.UniformResourceIdentifier(APPLICATION),
        x509.DNSName("localhost"),
        x509.IPAddress(ipaddress.ip_address("127.0.0.1")),
    ]
    usage = x509.KeyUsage(True, True, True, True, False, True, False, False, False)
    purposes = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(days=1))
        .not_valid_after(now + datetime.timedelta(days=2))
        .add_extension(x509.SubjectAlternativeName(alternatives), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.ExtendedKeyUsage(purposes), critical=False)
        .sign(key, hashes.SHA256())
    )
    key_file, certificate_file = folder / "key.pem", folder / "certificate.der"
    key_file.write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )
    certificate_file.write_bytes(certificate.public_bytes(serialization.Encoding.DER))
    return key_file, certificate_file


async def made_server(plan: dict) -> tuple[Server, dict]:
    server = Server()
    await server.init()
    server.set_endpoint(f"opc.tcp://127.0.0.1:{plan['port']}/")
    await server.set_application_uri(APPLICATION)
    if "secured" in plan:
        key, certificate = made_certificate(Path(plan["secured"]))
        await server.load_certificate(str(certificate))
        await server.load_private_key(str(key))
        server.set_security_policy([ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt])
    else:
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    for uri in plan["namespaces"]:
        await server.register_namespace(uri)
    index = await server.get_namespace_index(MACHINE)
    machine = await server.nodes.objects.add_object(index, "Machine")
    variables = {}
    for name, value in plan["values"].items():
        node = ua.NodeId(name, index)
        variables[name] = await machine.add_variable(node, name, value)
    return server, variables


async def write(variable, command: dict) -> None:
    value = command["value"]
    kind = ua.VariantType.Double if isinstance(value, float) else None
    at = datetime.datetime.fromtimestamp(command["at_s"], datetime.timezone.utc)
    data = ua.DataValue(
        Value=ua.Variant(value, kind),
        StatusCode=ua.StatusCode(command.get("status", 0)),
        SourceTimestamp=at,
        ServerTimestamp=at,
    )
    await variable.write_value(data)


async def burst(variables: dict, command: dict) -> None:
    names = command["names"]
    for number in range(command["burst"]):
        await variables[names[number % len(names)]].write_value(float(number))
        # Others have their turn: the server answers while it writes.
        if number % 100 == 99:
            await asyncio.sleep(0)


async def main() -> None:
    server, variables = await made_server(json.loads(sys.argv[1]))
    loop = asyncio.get_running_loop()
    async with server:
        said(event="ready")
        while line := await loop.run_in_executor(None, sys.stdin.readline):
            command = json.loads(line)
            if "burst" in command:
                await burst(variables, command)
            else:
                await write(variables[command["write"]], command)
            said(event="done")


asyncio.run(main())
